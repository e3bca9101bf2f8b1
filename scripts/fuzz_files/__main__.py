"""scripts/fuzz: prints for each kind of file how many damaged ones were read, refused, or answered badly."""

import argparse
import shutil
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import List

import numpy as np

from fuzz_files.mutations import mutated
from fuzz_files.runs import run
from fuzz_files.samples import Sample, samples


def fuzz(sample: Sample, count: int, seed: int, folder: Path) -> List[str]:
    """Run the sample's commands on `count` damaged files; return in words what went wrong."""
    found: List[str] = []
    ends: Counter = Counter()
    for number in range(count + 1):
        command = sample.commands[number % len(sample.commands)]
        path = _copy(sample, number, seed, folder)
        outcome = run(sample, command, path, folder / "run")
        ends["read" if outcome.status == 0 else "refused"] += 1
        complaints = list(outcome.complaints(_size(path), command[0]))
        complaints += sample.maker.complaints(folder / "run/out") if sample.maker else []
        if number == 0 and outcome.status and not outcome.was_interrupted:
            complaints.append(f"the sound file is refused: {outcome.lines[-1:]}")
        found += [f"{sample.kind}, seed {seed}, mutation {number}, {command[0]}: {one}" for one in complaints]
    told = f"{sample.kind}: {ends['read']} read, {ends['refused']} refused, {len(found)} answered badly"
    print("\n  ".join([told, *found]), flush=True)
    return found


def _copy(sample: Sample, number: int, seed: int, folder: Path) -> Path:
    """Write the sample with its damages of that number, 0: none."""
    path = folder / f"damaged{sample.path.suffix}"
    if sample.path.is_dir():
        shutil.rmtree(str(path), ignore_errors=True)
        shutil.copytree(str(sample.path), str(path))
        (target,) = path.glob(sample.damaged)
    else:
        target = Path(shutil.copyfile(str(sample.path), str(path)))
    if number:
        rng, maker = np.random.default_rng([seed, number]), sample.maker
        target.write_bytes(maker.make(rng) if maker else mutated(target.read_bytes(), sample.is_text, rng))
    return path


def _size(path: Path) -> int:
    return sum(one.stat().st_size for one in path.rglob("*")) if path.is_dir() else path.stat().st_size


def main() -> int:
    """Parse the command line and run; return the exit status."""
    parser = argparse.ArgumentParser(prog="scripts/fuzz", description=__doc__)
    parser.add_argument("--files", action="store_true", required=True, help="damage files")
    parser.add_argument("--mutations", type=int, default=300, help="of each kind (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of all damages (default: %(default)s)")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help="only kinds whose name begins so")
    options = parser.parse_args()
    with TemporaryDirectory() as name:
        found: List[str] = []
        for sample in samples(Path(name)):
            if not options.kinds or sample.kind.startswith(tuple(options.kinds)):
                found += fuzz(sample, options.mutations, options.seed, Path(name))
    print(f"{len(found)} answered badly" if found else "nothing was answered badly")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
