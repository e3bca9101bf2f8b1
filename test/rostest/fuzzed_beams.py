"""Sends damaged messages of other packages' sonars through adapters, scans and the laser scan: none may crash."""

import random
import struct
from collections import Counter
from types import SimpleNamespace
from typing import Any, List

import genpy
import numpy as np
from foreign_messages import DEFINITIONS, message_classes, sane_message, serialised
from random_messages import RandomMessages

from node_support.errors import RefusedInput
from node_support.ros.callbacks import MessageClasses
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.beams.head import HeadWatch
from sonar_processing.beams.reader import BeamMessageParameters, BeamReader
from sonar_processing.scans.assembler import RevolutionCollector, ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan, planar_laser_scan

_DAMAGED_DEFINITIONS = 0.002  # Share: each takes 10 ms


class Fuzzer:
    """Counts what becomes of each message: "taken", the kind of its refusal, or the exception that nobody caught."""

    def __init__(self, seed: int) -> None:
        self.outcomes: Counter[str] = Counter()
        self.crashes: List[str] = []
        self._random, self._source = random.Random(seed), RandomMessages(seed)
        self._parameters = SonarToCloudParameters()
        self._classes, self._reader = MessageClasses(), BeamReader(BeamMessageParameters())
        self._watch, self._assembler = HeadWatch(), ScanAssembler(self._parameters)
        self._revolution = RevolutionCollector()

    def send(self, number: int) -> None:
        """Send message number `number`, sane or damaged."""
        kind = self._random.choice(list(DEFINITIONS))
        message = self.message(kind, number)
        try:
            typed = self._classes.deserialised(message)
            for beam in self._reader.read(kind, typed).beams:
                self._process(beam)
        except RefusedInput as refused:
            self.outcomes[refused.kind] += 1
        except Exception as error:  # Whatever it is, it is what is looked for
            self.outcomes["crashes"] += 1
            self.crashes.append(f"{kind}: {type(error).__name__}: {error}")
        else:
            self.outcomes["taken"] += 1

    def _process(self, beam: Beam) -> None:
        self._watch.add(beam)
        placed = PlacedBeam(self._parameters.corrected(beam), np.eye(4), is_moving=False)
        self._assembler.add(placed)
        turn = self._revolution.add(placed)
        if turn is not None:
            planar_laser_scan(PolarScan.of(turn), self._parameters)

    def message(self, kind: str, number: int) -> Any:
        """Return a message of a kind, sane or damaged, as a subscriber to AnyMsg gets it."""
        made = sane_message(kind, number)
        if self._random.random() < 0.6:
            self._source.spoil(made)
        try:
            data = serialised(made)
        except genpy.SerializationError:
            data = serialised(sane_message(kind, number))
        if self._random.random() < 0.3:
            data = self._damaged(data)
        header = {"type": kind, "md5sum": message_classes(kind)[kind]._md5sum, "message_definition": DEFINITIONS[kind]}
        if self._random.random() < _DAMAGED_DEFINITIONS:
            definition = self._damaged(DEFINITIONS[kind].encode()).decode(errors="replace")
            header.update(md5sum=str(number), message_definition=definition)
        return SimpleNamespace(_connection_header=header, _buff=data)

    def _damaged(self, data: bytes) -> bytes:
        changed = bytearray(data)
        what = self._random.randrange(4)
        place = self._random.randrange(len(changed))
        if what == 0:
            del changed[place:]
        elif what == 1:
            changed[place : place + 4] = struct.pack("<I", self._random.getrandbits(32))
        elif what == 2:
            changed[place:place] = self._random.getrandbits(64).to_bytes(8, "little")
        else:
            changed[place] ^= 1 << self._random.randrange(8)
        return bytes(changed)


def fuzz(messages: int, seed: int) -> Fuzzer:
    """Send that many messages."""
    fuzzer = Fuzzer(seed)
    for number in range(messages):
        fuzzer.send(number)
    return fuzzer
