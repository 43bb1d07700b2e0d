# SPDX-License-Identifier: BSD-3-Clause
"""A state that calls a service; a request to stop ends the wait for the response."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import rospy

import smach
from modular_framework_ros.calls import CallError, call_service, is_advertised
from smach_ros.message_exchange import ExchangeError, MessageSink, MessageSource, ServerCallState
from smach_ros.waiting import seconds

__all__ = ["ServiceState"]


class ServiceState(ServerCallState):
    """Outcomes: succeeded, aborted, preempted, and the user's outcomes."""

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
        """Creates the state.

        Args:
            service_name: Name of the service.
            service_spec: Service class, such as ``std_srvs.srv.Trigger``.
            request: Request before the changes by keys and callback; None for an empty request.
            request_cb: Function that receives (userdata, request, *args, **kwargs); may change or replace the request.
            request_cb_args: Additional positional arguments of ``request_cb``.
            request_cb_kwargs: Additional keyword arguments of ``request_cb``.
            request_key: Userdata key of the request.
            request_slots: Request fields that are read from userdata keys of the same names.
            response_cb: Function that receives (userdata, response, *args, **kwargs) and may return an outcome.
            response_cb_args: Additional positional arguments of ``response_cb``.
            response_cb_kwargs: Additional keyword arguments of ``response_cb``.
            response_key: Userdata key that receives the response.
            response_slots: Response fields that are stored under userdata keys of the same names.
            input_keys: Additional userdata keys that are read.
            output_keys: Additional userdata keys that are written.
            outcomes: Additional outcomes for ``response_cb``.
            io_keys: Additional userdata keys that are read and written.
            server_wait_timeout: Maximum wait for the service [wall time]; None for no limit.
            exec_timeout: Maximum wait for the response [wall time]; None for no limit.

        Raises:
            smach.InvalidStateError: An argument is invalid; the message names the allowed values.
        """
        super().__init__(input_keys, output_keys, io_keys, outcomes)
        self._service_name = service_name
        self._service_spec = service_spec
        self._server_wait_timeout_s = seconds("server_wait_timeout", server_wait_timeout)
        limit_s = seconds("exec_timeout", exec_timeout)
        self._exec_timeout_s = math.inf if limit_s is None else limit_s
        empty_request, empty_response = _empty_messages(service_name, service_spec)
        on_request = self._user_callback("request_cb", request_cb, request_cb_args, request_cb_kwargs)
        on_response = self._user_callback("response_cb", response_cb, response_cb_args, response_cb_kwargs)
        self._use(
            MessageSource("request", empty_request, request, key=request_key, slots=request_slots, callback=on_request),
            MessageSink("response", empty_response, response_key, response_slots, on_response),
        )

    def execute(self, userdata: Any) -> str:
        """Waits for the service, calls it and processes the response."""
        self.reason = ""
        try:
            if self._wait_for_server(
                f"service '{self._service_name}'",
                lambda: is_advertised(self._service_name),
                self._server_wait_timeout_s,
                "it was not advertised",
            ):
                proxy, request = rospy.ServiceProxy(self._service_name, self._service_spec), self._source.make(userdata)
                if not self._is_stopped():
                    response = call_service(proxy, request, self._exec_timeout_s, self._is_stopped)
                    chosen = self._sink.deliver(userdata, self.get_registered_outcomes(), response)
                    return "succeeded" if chosen is None else chosen
        except ExchangeError as error:
            return self._abort(f"service '{self._service_name}': {error}")
        except CallError as error:
            if not self._is_stopped():
                return self._abort(str(error))
        return self._preempt_with(f"service '{self._service_name}': stopped before it responded")


def _empty_messages(service_name: str, service_spec: Any) -> tuple[Any, Any]:
    """Returns an empty request and response of a service class; raises ``InvalidStateError`` for other objects."""
    if not isinstance(service_name, str) or not service_name:
        raise smach.InvalidStateError(f"service_name must be the name of a service, got {service_name!r}")
    try:
        return service_spec._request_class(), service_spec._response_class()
    except (AttributeError, TypeError) as error:
        raise smach.InvalidStateError(
            f"service_spec of '{service_name}' must be the class of a service such as std_srvs.srv.Trigger, "
            f"got {service_spec!r}"
        ) from error
