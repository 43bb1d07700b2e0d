// SPDX-License-Identifier: BSD-3-Clause
// Messages between the page of an episode in a frame and the page of the pair that contains the frame.

/** Whether this page is a frame of the page of a pair. */
export const isSide = window.parent !== window && new URLSearchParams(location.search).get("clock") === "simulated";

/**
 * Sends a message to the page of the pair; no effect outside of a pair.
 * @param {{end_s?: number, view_s?: ?number, cursor_s?: ?number}} message End of the task, shown time and time at the
 *   mouse [s since the start of the task]; null for the latest state and without a cursor.
 */
export function tellPair(message) {
  if (isSide) window.parent.postMessage(message, location.origin);
}

/**
 * Calls a function with each message of another page of this server.
 * @param {function(MessageEvent): void} handle
 */
export function onPairMessage(handle) {
  window.addEventListener("message", (event) => {
    if (event.origin === location.origin) handle(event);
  });
}
