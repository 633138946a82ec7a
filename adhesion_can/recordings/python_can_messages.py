"""Messages of python-can as frames, and back."""

import can

from adhesion_can.bus.frame import Frame, to_us


def from_message(message: can.Message, t_us: int | None = None) -> Frame:
    """python-can's message as a frame.

    Args:
        message: The message.
        t_us: Time stamp of the frame, µs; None takes the message's.

    """
    channel = message.channel
    name = "" if channel is None else str(channel)
    return Frame(
        t_us=to_us(message.timestamp) if t_us is None else t_us,
        arbitration_id=message.arbitration_id,
        data=b"" if message.is_error_frame or message.is_remote_frame else bytes(message.data),
        channel=f"can{name}" if name.isdigit() else name,
        is_extended=message.is_extended_id and not message.is_error_frame,
        is_fd=message.is_fd,
        is_remote=message.is_remote_frame,
        is_error=message.is_error_frame,
    )


def to_message(frame: Frame) -> can.Message:
    """A frame as python-can's message."""
    return can.Message(
        timestamp=frame.t_us / 1e6,
        arbitration_id=frame.arbitration_id,
        data=frame.data,
        is_extended_id=frame.is_extended,
        is_remote_frame=frame.is_remote,
        is_error_frame=frame.is_error,
        is_fd=frame.is_fd,
        is_rx=False,
        check=False,
    )
