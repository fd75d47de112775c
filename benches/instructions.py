"""Counts the instructions of each sum over bonds and compares them with those in instructions.json.

A count does not depend on the machine's mood, so that a few per cent lost in a loop are seen in any run. Each kernel
runs twice under callgrind, with k and 2 k evaluations, so that its set-up cancels; what is left is divided by bond
updates.

    python3 benches/instructions.py            compare; fails when a count is off by more than 2 %
    python3 benches/instructions.py --bless    write the counts of now, after a change that was meant

Needs cargo and valgrind. Counts depend on the compiler, whose version is stored with them.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).parent
STORED = HERE / "instructions.json"
EVALUATIONS = 1
TOLERANCE = 0.02


def output(*command):
    return subprocess.run(command, check=True, cwd=HERE.parent, stdout=subprocess.PIPE, text=True).stdout


def built():
    """Builds the counted program in release; returns its path."""
    lines = output("cargo", "bench", "--locked", "--no-run", "--bench", "instructions", "--message-format=json")
    for line in lines.splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == "instructions" and message.get("executable"):
            return message["executable"]
    sys.exit("cargo built no program `instructions`")


def run(program, kernel, evaluations):
    """Instructions of a run, and the bond updates of one evaluation."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program, kernel, str(evaluations)]
    done = subprocess.run(command, capture_output=True, text=True)
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or not collected:
        sys.exit(f"{' '.join(command)} failed:\n{done.stderr}")
    return int(collected[1]), int(done.stdout)


def per_bond(program, kernel):
    (once, bonds), (twice, _) = run(program, kernel, EVALUATIONS), run(program, kernel, 2 * EVALUATIONS)
    return round((twice - once) / (EVALUATIONS * bonds), 4)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bless", action="store_true", help="write the counts of now")
    bless = parser.parse_args().bless
    program = built()
    compiler = output("rustc", "--version").strip()
    kernels = output(program).split()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        counts = dict(zip(kernels, pool.map(lambda kernel: per_bond(program, kernel), kernels)))
    stored = json.loads(STORED.read_text()) if STORED.exists() else {"rustc": "", "instructions_per_bond": {}}
    before = stored["instructions_per_bond"]
    wrong = [kernel for kernel in before if kernel not in counts]
    print(f"instructions per directed bond on AVX2, {compiler}")
    for kernel, count in counts.items():
        old = before.get(kernel)
        change = "new" if old is None else f"{100 * (count / old - 1):+.2f} %"
        print(f"{kernel:<44} {count:>9.3f}  {change}")
        if old is None or abs(count / old - 1) > TOLERANCE:
            wrong.append(kernel)
    if bless:
        STORED.write_text(json.dumps({"rustc": compiler, "instructions_per_bond": counts}, indent=2) + "\n")
    elif wrong:
        text = f"\ncounts are off by more than {100 * TOLERANCE:.0f} %: {', '.join(wrong)}"
        if stored["rustc"] != compiler:
            text += f"\nthey were made with {stored['rustc']}, this is {compiler}: the compiler may be the cause"
        sys.exit(text + "\nif that was meant: python3 benches/instructions.py --bless, and commit instructions.json")


if __name__ == "__main__":
    main()
