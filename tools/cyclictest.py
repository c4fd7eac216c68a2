#!/usr/bin/env python3
"""Wake-up of a 1 ms task against cyclictest (package rt-tests), in alternating pairs on the same computer.

    tools/cyclictest.py [--takt target/release/takt] [--pairs 10] [--seconds 30] [--spin 50us] [--cpu N]

Each pair runs cyclictest and Takt one after the other, every second pair the other way round. What is printed: p50 and p99 of both in microseconds,
the overruns of Takt, and the median over all pairs of the ratios. cyclictest has no spin: with --spin only Takt's own figures matter.
The load of the computer is printed too: figures of a busy one say little.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile

PROGRAM = """PROGRAM PLC_PRG
VAR n : UDINT; END_VAR
n := n + 1;
END_PROGRAM
CONFIGURATION C
RESOURCE R ON CPU
TASK Main(INTERVAL := T#1ms, PRIORITY := 0);
PROGRAM P WITH Main : PLC_PRG;
END_RESOURCE
END_CONFIGURATION
"""


def percentile(histogram, share):
    """Of a histogram {value: count}."""
    rank, seen = share * sum(histogram.values()), 0
    for value in sorted(histogram):
        seen += histogram[value]
        if seen >= rank:
            return value
    return 0


def cyclictest(seconds, cpu):
    command = ["cyclictest", "-q", "-m", "-p", "80", "-i", "1000", "-t", "1", "-h", "20000", "-D", str(seconds)]
    if cpu is not None:
        command += ["-a", str(cpu)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    histogram = {int(us): int(count) for us, count in re.findall(r"^(\d+)\s+(\d+)\s*$", output, re.M) if int(count)}
    if not histogram:
        sys.exit("cyclictest printed no histogram:\n" + output)
    return percentile(histogram, 0.5), percentile(histogram, 0.99)


def takt(program, seconds, folder):
    command = [program, "run", folder, "--speed", "real", "--for", f"{seconds}s", "--json"]
    output = subprocess.run(command, capture_output=True, text=True, check=False)
    if output.returncode != 0:
        sys.exit(f"{' '.join(command)}:\n{output.stderr}")
    if output.stderr:
        print(output.stderr.strip(), file=sys.stderr)
    found = json.loads(output.stdout)
    task = found["tasks"][0]
    jitter = task["jitter_ns"]
    return jitter["p50"] / 1e3, jitter["p99"] / 1e3, task["overruns"], found["thread"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--takt", default="target/release/takt")
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--seconds", type=int, default=30)
    parser.add_argument("--spin")
    parser.add_argument("--cpu", type=int)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(os.path.join(folder, "src"))
        with open(os.path.join(folder, "src", "main.st"), "w", encoding="utf-8") as file:
            file.write(PROGRAM)
        with open(os.path.join(folder, "takt.toml"), "w", encoding="utf-8") as file:
            file.write("[realtime]\npriority = 80\n")
            if args.spin:
                file.write(f'spin = "{args.spin}"\n')
            if args.cpu is not None:
                file.write(f"cpu = {args.cpu}\n")
        ratios = []
        print("pair  cyclictest p50 p99   takt p50 p99   overruns  faults  load")
        for pair in range(args.pairs):
            if pair % 2 == 0:
                other, own = cyclictest(args.seconds, args.cpu), takt(args.takt, args.seconds, folder)
            else:
                own = takt(args.takt, args.seconds, folder)
                other = cyclictest(args.seconds, args.cpu)
            ratios.append((own[0] / max(other[0], 0.5), own[1] / max(other[1], 0.5)))
            thread = own[3]
            faults = thread["minor_faults"] + thread["major_faults"]
            load = os.getloadavg()[0]
            print(f"{pair + 1:4}  {other[0]:14.1f} {other[1]:5.1f} {own[0]:9.2f} {own[1]:5.1f} {own[2]:9} {faults:7} {load:6.2f}", flush=True)
    p50, p99 = (statistics.median(ratio[i] for ratio in ratios) for i in (0, 1))
    print(f"median of the ratios: p50 {p50:.2f}, p99 {p99:.2f}")


if __name__ == "__main__":
    main()
