// SPDX-License-Identifier: BSD-3-Clause
// Sends goals one after another with roscpp's SimpleActionClient.
//
//     roscpp_client ACTION GOALS
//
// Prints a JSON object as the parts of client_latency do.
#include <actionlib/TestAction.h>
#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace
{
const double LOST_AFTER_S = 10.0;
}

int main(int argc, char** argv)
{
  ros::init(argc, argv, "roscpp_client");
  if (argc != 3)
  {
    std::fprintf(stderr, "usage: roscpp_client ACTION GOALS\n");
    return 2;
  }
  actionlib::SimpleActionClient<actionlib::TestAction> client(argv[1], true);
  if (!client.waitForServer(ros::Duration(60.0)))
    return 1;
  std::vector<double> waits_ms;
  int lost = 0;
  for (int number = 0; number < std::atoi(argv[2]); ++number)
  {
    actionlib::TestGoal goal;
    goal.goal = number;
    const auto begun = std::chrono::steady_clock::now();
    client.sendGoal(goal);
    if (client.waitForResult(ros::Duration(LOST_AFTER_S)) && client.getResult()->result == number)
      waits_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun).count());
    else
      ++lost;
  }
  std::sort(waits_ms.begin(), waits_ms.end());
  const std::size_t count = waits_ms.size();
  std::printf("{\"goals\": %d, \"lost\": %d, \"wait_median_ms\": %.2f, \"wait_p99_ms\": %.2f}\n", std::atoi(argv[2]), lost,
              count ? waits_ms[count / 2] : 0.0, count ? waits_ms[(count - 1) * 99 / 100] : 0.0);
  return 0;
}
