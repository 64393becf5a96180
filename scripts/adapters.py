#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How late does each camera's and each device's driver make the force, beside the synthetic camera?

scripts/adapters.py BUILD [SECONDS]
  BUILD    a folder built with the tests, such as build/test/gcc: the program and the fakes
  SECONDS  each session lasts (10)

Each driver runs in a session in real time, with the fake of its library that the tests use, at
640 x 480 pixels and 30 Hz; cameras beside a fake omega, devices beside the synthetic camera. Prints
the tables of docs/cameras.md and docs/devices.md. Nothing else should run meanwhile.
"""
import json
import mmap
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time

SYNTHETIC = "synthetic:plane?size=640x480"
OMEGA = "force-dimension:"


def run(build, seconds, camera, device, more=(), environment=None):
    """What the program says of one session, as JSON."""
    fakes = build / "tests/fakes/libraries"
    variables = {
        "PALPATE_LIBREALSENSE": fakes / "realsense", "PALPATE_LIBFREENECT": fakes / "freenect",
        "PALPATE_OPENNI2": fakes / "openni2", "PALPATE_FORCE_DIMENSION": fakes / "force-dimension",
        "PALPATE_OPENHAPTICS": fakes / "openhaptics", "PALPATE_SPNAV": fakes / "spnav",
        "PALPATE_SDL2": fakes / "sdl2", "FAKE_CAMERA": "width=640 height=480"}
    said = subprocess.run(
        [build / "app/palpate", "run", "--headless", "--json", "--duration", str(seconds),
         "--limit", "max_device_force=1", "--camera", camera, "--device", device, *more],
        env=os.environ | {name: str(value) for name, value in variables.items()}
        | (environment or {}), capture_output=True, text=True, check=False)
    if said.returncode != 0:
        sys.exit(f"adapters: {camera} {device}: {said.stderr.strip()}")
    return json.loads(said.stdout)


def lateness(session):
    """How late ticks began: the cells p50, p99, p99.9 and largest [us]."""
    servo = session["servo"]
    return " | ".join(f"{1e6 * servo['wake_up_' + share + '_s']:.0f}"
                      for share in ("p50", "p99", "p999", "max"))


def cameras(build, seconds, folder):
    lens = folder / "lens.json"
    lens.write_text(json.dumps({"width": 640, "height": 480, "fx": 768.0, "fy": 768.0, "cx": 319.5,
                                "cy": 239.5, "depth_units_per_metre": 1000}))
    kernel = {"LD_PRELOAD": str(build / "tests/fakes/libraries/v4l2/fake_v4l2.so")}
    stock = build / "tests/fakes/libraries/openni2-stock"
    has_stock = (stock / "OpenNI2/Drivers/libVirtual.so.0").exists()
    rows = [("`synthetic:`", SYNTHETIC, {}), ("`realsense:`", "realsense:", {}),
            ("`openni2:`", "openni2:", {}),
            ("`openni2:`, real library", "openni2:", {"PALPATE_OPENNI2": str(stock)}),
            ("`freenect:`", "freenect:", {}),
            ("`v4l2:`", f"v4l2:/dev/video77?intrinsics={lens}", kernel)]
    print("| camera | rate [Hz] | capture to arrival [ms] | arrival to force, p50, p99 [ms] "
          "| ticks late, p50 [us] | p99 | p99.9 | max |\n|---|---|---|---|---|---|---|---|")
    for name, camera, environment in rows:
        if name.endswith("real library") and not has_stock:
            continue
        session = run(build, seconds, camera, OMEGA, environment=environment)
        status, servo = session["cameras"][0], session["servo"]
        print(f"| {name} | {status['rate_hz']:.1f} | {1e3 * status['latency_s']:.1f} "
              f"| {1e3 * servo['hand_over_p50_s']:.2f}, {1e3 * servo['hand_over_p99_s']:.2f} "
              f"| {lateness(session)} |", flush=True)


def devices(build, seconds, folder):
    bench = folder / "service"
    bench.write_bytes(struct.pack("24d", 1, 1, 0, 0, 3.4, 1, *[0] * 18))
    script = pathlib.Path(__file__).resolve().parent.parent / "tests/fakes/inverse_service.py"
    service = subprocess.Popen([sys.executable, script, bench])
    with open(bench, "r+b") as file:
        memory = mmap.mmap(file.fileno(), 0)
    port = 0.0
    while port == 0.0 and service.poll() is None:
        time.sleep(0.01)
        port = struct.unpack_from("d", memory, 8 * 6)[0]
    rows = [("`mouse:`", "mouse:", ()), ("`force-dimension:`", OMEGA, ()),
            ("`touch:` with its guard", "touch:", ()),
            ("`touch:` in its callback", "touch:", ("--without-watchdog",)),
            ("`haply:` with its guard", f"haply:?port={port:.0f}", ()),
            ("`spacenav:`", "spacenav:", ()), ("`gamepad:`", "gamepad:", ())]
    print("| device | ticks per second | ticks late, p50 [us] | p99 | p99.9 | max |\n"
          "|---|---|---|---|---|---|")
    try:
        for name, device, more in rows:
            session = run(build, seconds, SYNTHETIC, device, more)
            print(f"| {name} | {session['ticks'] / session['duration_s']:.0f} "
                  f"| {lateness(session)} |", flush=True)
    finally:
        service.kill()
        service.wait()


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__.strip())
    build = pathlib.Path(sys.argv[1]).resolve()
    seconds = float(sys.argv[2]) if len(sys.argv) == 3 else 10.0
    with tempfile.TemporaryDirectory() as folder:
        cameras(build, seconds, pathlib.Path(folder))
        print()
        devices(build, seconds, pathlib.Path(folder))


if __name__ == "__main__":
    main()
