# SPDX-License-Identifier: BSD-3-Clause
"""A state that calls a service; asked to stop, it does not wait for the answer."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from typing import Any

import rospy

import smach
from smach_ros.message_exchange import AskingState, ExchangeError, MessageSink, MessageSource
from smach_ros.waiting import POLL_PERIOD_S, WallTimeLimit, seconds

__all__ = ["ServiceState"]

PROBE_TIME_S = 0.25
"""How long one check for the service takes at most [s]: the time in which a request to stop is noticed."""


class _Call(threading.Thread):
    """One call of a service, in a thread that can be left alone."""

    def __init__(self, proxy: rospy.ServiceProxy, request: Any) -> None:
        super().__init__(name=f"call {proxy.resolved_name}", daemon=True)
        self._proxy = proxy
        self._request = request
        self.ended = threading.Event()
        self.response: Any = None
        self.error: Exception | None = None

    def run(self) -> None:
        """Body of the thread."""
        try:
            self.response = self._proxy(self._request)
        except Exception as error:  # the state reports it, whatever it is
            self.error = error
        finally:
            self.ended.set()


class ServiceState(AskingState):
    """Outcomes: succeeded, aborted, preempted, and those the user adds."""

    def __init__(
        self,
        service_name: str,
        service_spec: Any,
        request: Any = None,
        request_cb: Any = None,
        request_cb_args: Iterable[Any] = (),
        request_cb_kwargs: Mapping[str, Any] | None = None,
        request_key: str | None = None,
        request_slots: Iterable[str] = (),
        response_cb: Any = None,
        response_cb_args: Iterable[Any] = (),
        response_cb_kwargs: Mapping[str, Any] | None = None,
        response_key: str | None = None,
        response_slots: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        io_keys: Iterable[str] = (),
        server_wait_timeout: rospy.Duration | None = rospy.Duration(60.0),  # noqa: B008 - never changed
        exec_timeout: rospy.Duration | None = None,
    ) -> None:
        """Makes the state.

        Args:
            service_name: name of the service.
            service_spec: its type, as ``std_srvs.srv.Trigger``.
            request: the request, or what it is started from; None: an empty one.
            request_cb: gets (userdata, request, *args, **kwargs), may change the request or return another one.
            request_cb_args: see there.
            request_cb_kwargs: see there.
            request_key: userdata key that holds the request.
            request_slots: fields of the request that are taken from userdata keys of the same names.
            response_cb: gets (userdata, response, *args, **kwargs), may return an outcome.
            response_cb_args: see there.
            response_cb_kwargs: see there.
            response_key: userdata key the response is put under.
            response_slots: fields of the response that are put under userdata keys of the same names.
            input_keys: further userdata keys that are read.
            output_keys: further userdata keys that are written.
            outcomes: further outcomes, for ``response_cb``.
            io_keys: further userdata keys that are read and written.
            server_wait_timeout: longest wait for the service [wall time]; None: no limit.
            exec_timeout: longest wait for the answer [wall time]; None: no limit.

        Raises:
            smach.InvalidStateError: an argument does not fit; the text says which and what would.
        """
        super().__init__(input_keys, output_keys, io_keys, outcomes)
        self._service_name = service_name
        self._service_spec = service_spec
        self._server_wait_timeout_s = seconds("server_wait_timeout", server_wait_timeout)
        self._exec_timeout_s = seconds("exec_timeout", exec_timeout)
        empty_request, empty_response = _empty_messages(service_name, service_spec)
        on_request = self._user_callback("request_cb", request_cb, request_cb_args, request_cb_kwargs)
        on_response = self._user_callback("response_cb", response_cb, response_cb_args, response_cb_kwargs)
        self._use(
            MessageSource("request", empty_request, request, request_key, request_slots, on_request),
            MessageSink("response", empty_response, response_key, response_slots, on_response),
        )

    def execute(self, userdata: Any) -> str:
        """Waits for the service, calls it and delivers the answer."""
        self.reason = ""
        try:
            if self._wait_for_server(
                f"service '{self._service_name}'",
                self._is_advertised,
                self._server_wait_timeout_s,
                "it was not advertised",
            ):
                call = _Call(rospy.ServiceProxy(self._service_name, self._service_spec), self._source.make(userdata))
                if self._wait_for_answer(call):
                    chosen = self._sink.deliver(userdata, self.get_registered_outcomes(), call.response)
                    return "succeeded" if chosen is None else chosen
        except ExchangeError as error:
            return self._abort(f"service '{self._service_name}': {error}")
        return self._preempted(f"service '{self._service_name}': asked to stop before it answered")

    def _is_advertised(self) -> bool:
        try:
            rospy.wait_for_service(self._service_name, PROBE_TIME_S)
        except rospy.ROSException:
            return False
        return True

    def _wait_for_answer(self, call: _Call) -> bool:
        """Calls the service; returns False when the state was asked to stop before the answer.

        Raises:
            ExchangeError: the call failed or took too long.
        """
        limit = WallTimeLimit(self._exec_timeout_s)
        if self._stopped():
            return False
        call.start()
        while not call.ended.wait(POLL_PERIOD_S):
            if self._stopped():
                return False
            if limit.over():
                raise ExchangeError(f"it did not answer within {self._exec_timeout_s} s")
        if call.error is not None:
            raise ExchangeError(f"the call failed: {call.error}")
        return True


def _empty_messages(service_name: str, service_spec: Any) -> tuple[Any, Any]:
    """Returns an empty request and response of a service type; raises ``InvalidStateError`` when it is none."""
    if not isinstance(service_name, str) or not service_name:
        raise smach.InvalidStateError(f"service_name must be the name of a service, got {service_name!r}")
    try:
        return service_spec._request_class(), service_spec._response_class()
    except (AttributeError, TypeError) as error:
        raise smach.InvalidStateError(
            f"service_spec of '{service_name}' must be the class of a service as std_srvs.srv.Trigger, "
            f"got {service_spec!r}"
        ) from error
