"""Any sequence of commands, held against a small model of the robot: what it answers and what it keeps."""

from __future__ import annotations

import math

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from khepera_hil.emulator import Emulator
from khepera_hil.protocol import ENCODER_PULSES_PER_MM
from khepera_hil.world import World

_SPEEDS = st.integers(-127, 127)
_COUNTS = st.integers(-(2**31), 2**31 - 1)
_MODES = {"D": 0, "C": 1, "P": 2}


class Robot(RuleBasedStateMachine):
    """A host that follows the robot's rate, so that it always understands it."""

    @initialize(seed=st.integers(0, 3), robot=st.sampled_from(["khepera", "khepera2"]))
    def start(self, seed: int, robot: str) -> None:
        self.emulator = Emulator(
            World("empty", seed),
            38400,
            host_follows=True,
            robot=robot,
            turrets=("gripper", "k213", "genio"),
        )
        self.now = 1.0
        assert self.emulator.transmitted(self.now) == self.emulator.model.boot
        self.forget()

    def forget(self) -> None:
        """The model, as after power-up."""
        self.leds = [0, 0]
        self.port = 0
        self.arm = 180
        self.mode = 0
        self.zeros = self.pulses()
        self.slack = 0.0
        """How exactly the zeros are known: they were read while the wheels went on."""
        self.rate = 38400

    def pulses(self) -> list[int]:
        return [math.floor(way * ENCODER_PULSES_PER_MM) for way in self.emulator.world.wheel_travel()]

    def way_since(self, began: float) -> float:
        """As far as a wheel can have gone since a moment, in pulses: not all is read at once."""
        return 128 * (self.now - began + 0.01) / 0.01

    def say(self, *lines: str) -> list[str]:
        """Lines in one breath, and all that is answered, by lines."""
        self.emulator.receive("".join(line + "\n" for line in lines).encode(), self.now)
        told = b""
        while self.emulator.talking:
            self.now += 0.003
            told += self.emulator.transmitted(self.now)
        *answers, end = told.decode().split("\r\n")
        assert end == ""
        return answers

    def ask(self, line: str) -> str:
        """One line and its one answer."""
        (answer,) = self.say(line)
        return answer

    def numbers(self, line: str) -> list[int]:
        answer = self.ask(line)
        letter, *values = answer.split(",")
        assert letter == line[0].lower()
        return [int(value) for value in values]

    @rule(order=st.sampled_from("DP"), left=_SPEEDS, right=_SPEEDS)
    def drive(self, order: str, left: int, right: int) -> None:
        assert self.ask(f"{order},{left},{right}") == order.lower()
        self.mode = _MODES[order]

    @rule()
    def stop(self) -> None:
        assert self.ask("D,0,0") == "d"
        self.mode = 0

    @rule(left=st.integers(-2000, 2000), right=st.integers(-2000, 2000))
    def go_to(self, left: int, right: int) -> None:
        assert self.ask(f"C,{left},{right}") == "c"
        self.mode = 1

    @rule(left=_COUNTS, right=_COUNTS)
    def set_counters(self, left: int, right: int) -> None:
        if self.mode != 1:  # a target would be sought by the new count
            began = self.now
            g, h = self.say(f"G,{left},{right}", "H")
            most = self.way_since(began)
            assert g == "g"
            read = [int(word) for word in h.split(",")[1:]]
            for wanted, got in zip((left, right), read, strict=True):
                assert abs((got - wanted + 2**31) % 2**32 - 2**31) <= most
            self.zeros = [pulse - value for pulse, value in zip(self.pulses(), read, strict=True)]
            self.slack = most

    @rule(gains=st.lists(st.integers(0, 32767), min_size=3, max_size=3), which=st.sampled_from("AF"))
    def set_gains(self, gains: list[int], which: str) -> None:
        assert self.ask(",".join([which, *map(str, gains)])) == which.lower()

    @rule(values=st.tuples(*[st.integers(0, 127), st.integers(0, 32767)] * 2))
    def set_profile(self, values: tuple[int, ...]) -> None:
        assert self.ask(",".join(["J", *map(str, values)])) == "j"

    @rule(led=st.integers(0, 1), action=st.integers(0, 2))
    def switch(self, led: int, action: int) -> None:
        assert self.ask(f"L,{led},{action}") == "l"
        self.leds[led] = 1 - self.leds[led] if action == 2 else action

    @rule(data=st.integers(0, 255))
    def write(self, data: int) -> None:
        assert self.ask(f"W,{data},32") == "w"
        self.port = data

    @rule(arm=st.integers(0, 255))
    def move_arm(self, arm: int) -> None:
        assert self.ask(f"T,1,E,{arm}") == "t,1,e"
        self.arm = arm

    @rule()
    def look(self) -> None:
        pixels = [int(word) for word in self.ask("T,2,N").split(",")[3:]]
        assert len(pixels) == 64
        assert all(0 <= pixel <= 255 for pixel in pixels)

    @rule(place=st.integers(0, 48))
    def look_at_parts(self, place: int) -> None:
        requests = "T,2,N", "T,2,S", "T,2,T", "T,2,M", f"T,2,Q,{place}", f"T,2,R,{place}", "T,2,O", "T,2,P", "T,2,N"
        told = [[int(word) for word in line.split(",")[3:]] for line in self.say(*requests)]
        pixels, second, fourth, pairs, eight, sixteen, brightest, darkest, after = told
        if pixels != after:
            return  # not from one frame
        assert (second, fourth) == (pixels[::2], pixels[::4])
        assert (eight, sixteen) == (pixels[place : place + 8], pixels[place : place + 16])
        assert [nibble for pair in pairs for nibble in divmod(pair, 16)] == [pixel // 16 for pixel in pixels]
        assert pixels[brightest[0]] == max(pixels)
        assert pixels[darkest[0]] == min(pixels)

    @rule(code=st.integers(0, 7))
    def hold_frames(self, code: int) -> None:
        assert self.ask(f"T,2,U,{code}") == "t,2,u"

    @rule(rate=st.sampled_from([9600, 19200, 38400]))
    def change_rate(self, rate: int) -> None:
        assert self.say(f"serial {rate}") == []
        self.rate = rate

    @rule(seconds=st.floats(0.001, 3.0))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        assert self.emulator.transmitted(self.now) == b""

    @rule()
    def restart(self) -> None:
        assert "\r\n".join([*self.say("restart"), ""]).encode() == self.emulator.model.boot
        began, counters = self.now, self.numbers("H")
        self.forget()
        self.slack = self.way_since(began)
        self.zeros = [pulse - value for pulse, value in zip(self.pulses(), counters, strict=True)]

    @rule(line=st.sampled_from(["huh", "D,1", "D,128,0", "L,2,0", "T,9,B", "T,2,Q,57", "n", "G,1,x", "Z,1"]))
    def say_nonsense(self, line: str) -> None:
        assert self.ask(line).startswith(("z,", "Command not found"))

    @invariant()
    def the_robot_is_as_the_model_says(self) -> None:
        if not hasattr(self, "emulator"):
            return
        assert self.emulator.leds == tuple(self.leds)
        assert self.emulator.baud == self.rate
        assert self.ask("R,32") == f"r,{self.port}"
        assert self.ask("T,1,H,1") == f"t,1,h,{self.arm}"
        status = self.numbers("K")
        assert status[1::3] == [self.mode] * 2
        assert set(status[::3]) <= {0, 1}
        assert all(abs(speed) <= 128 for speed in self.numbers("E"))
        began, counters = self.now, self.numbers("H")
        for pulse, zero, counter in zip(self.pulses(), self.zeros, counters, strict=True):
            assert abs((counter - (pulse - zero) + 2**31) % 2**32 - 2**31) <= self.slack + self.way_since(began)
        assert all(0 <= value <= 1023 for value in self.numbers("N"))
        assert all(0 <= value <= 511 for value in self.numbers("O"))
        # The body stays in the arena.
        x, y, _ = self.emulator.world.pose()
        assert 0 < x < 1
        assert 0 < y < 1


TestRobot = Robot.TestCase
TestRobot.settings = settings(max_examples=60, stateful_step_count=30)
