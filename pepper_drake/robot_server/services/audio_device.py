"""ALAudioDevice and ALAudioRecorder: microphones in a silent room."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pepper_drake.naoqi.clock import split_time
from pepper_drake.naoqi.wire import WireError
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.waiting import Module, RobotTimer
from pepper_drake.robot_server.wire.service import Service, ServiceError, ServiceFinder

Log = Callable[[str], None]

_SAMPLES = {48000: 4096, 16000: 1365}
"""Samples per channel and buffer by rate [1/s]: 85 ms each."""
_MICROPHONES = 4
_NOISE = 2
"""Largest noise of a microphone; the largest sound is 32767. An estimate."""
_REGISTERED = 10.0
"""Timeout of the registration of a subscribed module [s]."""


@dataclass(frozen=True)
class _Hearing:
    """A module's preferences: sampling rate [1/s], and channels (0: all four, else one)."""

    rate: int = 48000
    channels: int = 0


class AudioDevice(Module):
    """ALAudioDevice: its settings, and the noise of its microphones."""

    def __init__(
        self, log: Log, timer: RobotTimer, finder: Callable[[], ServiceFinder | None]
    ) -> None:
        """Makes the service.

        Args:
            log: Takes a line on calls without effect.
            timer: The robot's clock.
            finder: Returns the directory, in which listening modules are registered, or None.
        """
        super().__init__("ALAudioDevice")
        self._log, self._timer, self._finder = log, timer, finder
        self._formats: dict[str, _Hearing] = {}
        self._listening: dict[str, asyncio.Task[None]] = {}
        self._noise = np.random.default_rng(0)
        self._parameters: dict[str, int] = {}
        keep_settings(
            self,
            {
                "set_output_volume": ("get_output_volume", 50),
                "mute_audio_out": ("is_audio_out_muted", False),
            },
        )

    def set_client_preferences(
        self, module: str, rate: int, channels: int, _deinterleaved: int
    ) -> None:
        """Sets a module's sampling rate, 48000 or 16000 per second, and its channels."""
        if rate not in _SAMPLES:
            raise ValueError(f"the rate is {rate} Hz; it must be 48000 or 16000")
        if not 0 <= channels <= _MICROPHONES:
            raise ValueError(f"there are no channels {channels}; give 0 for all, or 1 to 4")
        self._formats[module] = _Hearing(rate, channels)

    def subscribe(self, module: str) -> None:
        """Subscribes a module: its `processRemote` is called with a buffer every 85 ms."""
        self.unsubscribe(module)
        self._log(f"{module} listens; nobody speaks, and it hears the noise of the microphones")
        task = asyncio.get_running_loop().create_task(self._hear(module))
        self._listening[module] = task

    def unsubscribe(self, module: str) -> None:
        """Ends a module's subscription."""
        task = self._listening.pop(module, None)
        if task is not None:
            task.cancel()

    async def _hear(self, module: str) -> None:
        """Calls a module with the microphones' buffers, until it is gone."""
        due, found = self._timer.now, False
        while True:
            finder = self._finder()
            target = finder.find(module) if finder is not None else None
            is_late = self._timer.now - due > _REGISTERED
            if target is None or isinstance(target, Service):
                if found or is_late:
                    break
                await self._timer.sleep(0.1)
                continue
            hearing = self._formats.get(module, _Hearing())
            samples = _SAMPLES[hearing.rate]
            channels = 1 if hearing.channels else _MICROPHONES
            sound = self._noise.integers(-_NOISE, _NOISE + 1, samples * channels, dtype=np.int16)
            due = self._timer.now + samples / hearing.rate
            found, stamp = True, list(split_time(self._timer.now))
            try:
                await target.call("processRemote", channels, samples, stamp, sound.tobytes())
            except (ServiceError, WireError) as error:
                self._log(f"{module} cannot hear: {error}")
                break
            await self._timer.sleep(due - self._timer.now)
        self._listening.pop(module, None)

    def enable_energy_computation(self) -> None:
        """Switches the computation of energies on; there is nothing to hear."""

    def disable_energy_computation(self) -> None:
        """Switches the computation of energies off."""

    def open_audio_inputs(self) -> None:
        """Opens the microphones."""

    def close_audio_inputs(self) -> None:
        """Closes the microphones."""

    def open_audio_outputs(self) -> None:
        """Opens the loudspeakers."""

    def close_audio_outputs(self) -> None:
        """Closes the loudspeakers."""

    def is_input_closed(self) -> bool:
        """Returns whether the microphones are closed."""
        return False

    def is_output_closed(self) -> bool:
        """Returns whether the loudspeakers are closed."""
        return False

    def start_microphones_recording(self, name: str) -> None:
        """Logs that nothing is recorded."""
        self._log(f"no sound is simulated, and {name} is not written")

    def stop_microphones_recording(self) -> None:
        """Has no effect."""

    def set_file_as_input(self, name: str) -> None:
        """Logs that the file is not heard."""
        self._log(f"no sound is simulated, and {name} is not heard")

    def _no_energy(self) -> float:
        """Returns a microphone's energy, zero without sound."""
        return 0.0

    get_front_mic_energy = _no_energy
    get_rear_mic_energy = _no_energy
    get_left_mic_energy = _no_energy
    get_right_mic_energy = _no_energy

    def flush_audio_outputs(self) -> None:
        """Has no effect."""

    def play_sine(self, frequency: int, _gain: int, _pan: int, duration: float) -> None:
        """Plays a tone [Hz, s]."""
        self._log(f"plays a tone of {frequency} Hz for {duration:g} s (no sound is simulated)")

    def send_remote_buffer_to_output(self, frames: int, _buffer: Any) -> bool:
        """Takes sound; returns whether it fits: at most 16384 frames."""
        return 0 <= frames <= 16384

    def set_parameter(self, name: str, value: int) -> None:
        """Stores a parameter."""
        self._parameters[name] = value

    def get_parameter(self, name: str) -> int:
        """Returns a stored parameter."""
        if name not in self._parameters:
            raise ValueError(f"there is no parameter {name!r}")
        return self._parameters[name]


class AudioRecorder(Module):
    """ALAudioRecorder: logs the name of the file; there is nothing to record."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALAudioRecorder")
        self._log = log

    def start_microphones_recording(self, name: str, *_: Any) -> None:
        """Logs that nothing is recorded."""
        self._log(f"no sound is simulated, and {name} is not written")

    def stop_microphones_recording(self) -> None:
        """Has no effect."""
