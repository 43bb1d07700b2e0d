# SPDX-License-Identifier: BSD-3-Clause
"""Provides a state machine as an action: a goal executes the machine, whose outcome ends the goal."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Mapping
from typing import Any

import rospy

import smach
from modular_framework_ros.action_server import SteadySimpleActionServer

__all__ = ["ActionServerWrapper"]


class ActionServerWrapper:
    """An action server around a container.

    Attributes:
        wrapped_container: Wrapped container.
        userdata: Userdata of the container, which receives the goal and provides the result.
    """

    def __init__(
        self,
        server_name: str,
        action_spec: Any,
        wrapped_container: smach.Container,
        succeeded_outcomes: Iterable[str] = (),
        aborted_outcomes: Iterable[str] = (),
        preempted_outcomes: Iterable[str] = (),
        goal_key: str = "action_goal",
        feedback_key: str = "action_feedback",
        result_key: str = "action_result",
        goal_slots_map: Mapping[str, str] | None = None,
        feedback_slots_map: Mapping[str, str] | None = None,
        result_slots_map: Mapping[str, str] | None = None,
        expand_goal_slots: bool = False,
        pack_result_slots: bool = False,
    ) -> None:
        """Creates the server; ``run_server`` starts it.

        Args:
            server_name: Name of the action.
            action_spec: Action class, such as ``FibonacciAction``.
            wrapped_container: Container to execute, which declares its userdata keys as input and output keys.
            succeeded_outcomes: Outcomes for which the goal succeeded.
            aborted_outcomes: Outcomes for which the goal is aborted; an outcome in no list aborts the goal, too.
            preempted_outcomes: Outcomes for which the goal is preempted.
            goal_key: Userdata key of the goal.
            feedback_key: Userdata key of the feedback, which is published at each transition.
            result_key: Userdata key of the result.
            goal_slots_map: Userdata key that receives a goal field, keyed by field.
            feedback_slots_map: Userdata key of the container that provides a feedback field, keyed by field.
            result_slots_map: Userdata key that provides a result field, keyed by field.
            expand_goal_slots: Whether to store each goal field under the key of its name.
            pack_result_slots: Whether to take result fields from existing keys of their names.

        Raises:
            smach.InvalidConstructionError: An argument is invalid; the message names the allowed values.
        """
        if not isinstance(wrapped_container, smach.Container):
            raise smach.InvalidConstructionError(
                f"'{server_name}' needs a container, got a {type(wrapped_container).__name__}"
            )
        self.wrapped_container = wrapped_container
        self.userdata = smach.UserData()
        self._server_name = server_name
        self._action_spec = action_spec
        self._goal_key, self._feedback_key, self._result_key = goal_key, feedback_key, result_key
        self._expand_goal_slots, self._pack_result_slots = expand_goal_slots, pack_result_slots
        self._new_goal_data(None)
        self._goal_slots_map = self._checked_slots_map("goal_slots_map", goal_key, goal_slots_map)
        self._feedback_slots_map = self._checked_slots_map("feedback_slots_map", feedback_key, feedback_slots_map)
        self._result_slots_map = self._checked_slots_map("result_slots_map", result_key, result_slots_map)
        self._succeeded_outcomes = frozenset(succeeded_outcomes)
        self._aborted_outcomes = frozenset(aborted_outcomes)
        self._preempted_outcomes = frozenset(preempted_outcomes)
        self._check_outcomes()
        wrapped_container.register_transition_cb(self.transition_cb)
        wrapped_container.register_termination_cb(self.termination_cb)
        self._action_server = SteadySimpleActionServer(server_name, action_spec, self.execute_cb)

    def _new_goal_data(self, goal: Any) -> None:
        """Stores a goal, or an empty goal for None, in the userdata with an empty feedback and result."""
        try:
            action = self._action_spec()
            empty = action.action_goal.goal, action.action_feedback.feedback, action.action_result.result
        except (AttributeError, TypeError) as error:
            raise smach.InvalidConstructionError(
                f"action_spec of '{self._server_name}' must be the class of an action such as FibonacciAction, "
                f"got {self._action_spec!r}"
            ) from error
        self.userdata[self._goal_key] = empty[0] if goal is None else goal
        self.userdata[self._feedback_key] = empty[1]
        self.userdata[self._result_key] = empty[2]

    def _checked_slots_map(self, label: str, key: str, slots_map: Mapping[str, str] | None) -> dict[str, str]:
        message = self.userdata[key]
        unknown = [slot for slot in slots_map or {} if slot not in message.__slots__]
        if unknown:
            raise smach.InvalidConstructionError(
                f"{label} of '{self._server_name}': {unknown} are no fields of {message._type}; "
                f"its fields are {list(message.__slots__)}"
            )
        return dict(slots_map or {})

    def _check_outcomes(self) -> None:
        lists = (self._succeeded_outcomes, self._aborted_outcomes, self._preempted_outcomes)
        everything = sorted(name for names in lists for name in names)
        twice = sorted({name for name in everything if everything.count(name) > 1})
        if twice:
            raise smach.InvalidConstructionError(
                f"'{self._server_name}': the outcomes {twice} are in more than one of succeeded_outcomes, "
                "aborted_outcomes and preempted_outcomes; leave each in one"
            )
        known = self.wrapped_container.get_registered_outcomes()
        unknown = [name for name in everything if name not in known]
        if unknown:
            smach.logwarn(f"'{self._server_name}' lists outcomes {unknown} the container does not have: {list(known)}")

    def run_server(self) -> None:
        """Starts the server; does not block."""
        self._action_server.register_preempt_callback(self.preempt_cb)
        self._action_server.start()
        smach.loginfo(f"state machine is offered as action '{rospy.resolve_name(self._server_name)}'")

    # ---- callbacks of the container ------------------------------------------------------------------------
    def transition_cb(self, userdata: Any, active_states: list[str]) -> None:
        """Publishes the feedback after a transition."""
        self.publish_feedback(userdata)

    def termination_cb(self, userdata: Any, terminal_states: list[str], container_outcome: str | None) -> None:
        """Logs the end of the container; called by the container.

        Args:
            userdata: Userdata of the container.
            terminal_states: Labels of the last states.
            container_outcome: Outcome of the container.
        """
        smach.logdebug(f"'{self._server_name}': container ended in {terminal_states} with '{container_outcome}'")

    def publish_feedback(self, userdata: Any) -> None:
        """Publishes the feedback in the container's userdata with its mapped fields, if there is any."""
        if self._feedback_key not in userdata and not self._feedback_slots_map:
            return
        source = userdata if self._feedback_key in userdata else self.userdata
        feedback = source[self._feedback_key]
        for slot, key in self._feedback_slots_map.items():
            if key in userdata:
                setattr(feedback, slot, userdata[key])
        self._action_server.publish_feedback(feedback)

    # ---- callbacks of the action server --------------------------------------------------------------------
    def preempt_cb(self) -> None:
        """Requests preemption of the container when the goal is cancelled."""
        smach.loginfo(f"'{self._server_name}': the goal is cancelled, the state machine is asked to stop")
        self.wrapped_container.request_preempt()

    def execute_cb(self, goal: Any) -> None:
        """Executes the container for a goal, and ends the goal according to the outcome."""
        container = self.wrapped_container
        self._new_goal_data(goal)
        for slot in goal.__slots__ if self._expand_goal_slots else ():
            self.userdata[slot] = getattr(goal, slot)
        for slot, key in self._goal_slots_map.items():
            self.userdata[key] = getattr(goal, slot)
        container.recall_preempt()  # from an earlier goal
        if self._action_server.is_preempt_requested():
            container.request_preempt()
        inputs, outputs = container.get_registered_input_keys(), container.get_registered_output_keys()
        try:
            outcome = container.execute(smach.Remapper(self.userdata, inputs, outputs, {}))
            result = self._packed_result()
        except Exception as error:  # any error of a state ends this goal, not the server
            smach.logerr(f"'{self._server_name}': the state machine raised:\n{traceback.format_exc()}")
            self._action_server.set_aborted(text=f"the state machine raised {type(error).__name__}: {error}")
            return
        self._end_goal(outcome, result)

    def _packed_result(self) -> Any:
        result = self.userdata[self._result_key]
        for slot, key in self._result_slots_map.items():
            if key not in self.userdata:
                raise smach.InvalidUserCodeError(
                    f"field '{slot}' of the result is userdata key '{key}', which the state machine did not set"
                )
            setattr(result, slot, self.userdata[key])
        for slot in result.__slots__ if self._pack_result_slots else ():
            if slot in self.userdata:
                setattr(result, slot, self.userdata[slot])
        return result

    def _end_goal(self, outcome: str, result: Any) -> None:
        text = f"the state machine ended with outcome '{outcome}'"
        smach.loginfo(f"'{self._server_name}': {text}")
        if outcome in self._succeeded_outcomes:
            self._action_server.set_succeeded(result, text)
        elif outcome in self._preempted_outcomes:
            self._action_server.set_preempted(result, text)
        else:
            self._action_server.set_aborted(result, text)
