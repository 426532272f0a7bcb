"""Attitude errors of VQF, Madgwick and Mahony on the BROAD trials, beside kfdesign's, by the benchmark's own metric.

python benches/attitude_peers.py FOLDER [KFDESIGN], with vqf 2.1.2, ahrs 0.4.0, h5py, scipy.
FOLDER holds the trials as .hdf5 or level-5 .mat; KFDESIGN is the program (default: kfdesign on the path).
Madgwick and Mahony run with their packages' default gains and with those that the benchmark found best over all its trials
(beta 0.12; Kp 0.74, Ki 0.0012); the table has the better of the two for each trial. Every method has one setting otherwise.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np
import scipy.io
import scipy.spatial.transform
import vqf
from ahrs.filters import Madgwick, Mahony

# Rounded from `identify` on the first rest of trial 05.
AXES = [("x", 0.0055), ("y", 0.0049), ("z", 0.0052)]
GYRO = {
    "format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "285.7142857142857 Hz",
    "axes": [{"name": n, "turn_on_bias": {"std_dev": "0.3 deg/s"}, "white": {"density": f"{d} deg/s/sqrt(Hz)"}} for n, d in AXES],
}
FORCE = {
    "format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "285.7142857142857 Hz",
    "axes": [{"name": "z", "white": {"density": "0.0041 m/s^2/sqrt(Hz)"}}],
}


def load(path):
    if path.suffix == ".mat":
        data = scipy.io.loadmat(path, squeeze_me=True)
        rate = float(data["sampling_rate"])
    else:
        with h5py.File(path) as file:
            data = {key: np.array(file[key]) for key in file}
            rate = float(file.attrs["sampling_rate"])
    sensors = [np.ascontiguousarray(data["imu_" + key], dtype=float) for key in ("gyr", "acc", "mag")]
    return *sensors, data["opt_quat"], np.asarray(data["movement"]).astype(bool).ravel(), rate


def multiply(a, b):
    w1, x1, y1, z1 = np.moveaxis(np.asarray(a, float), -1, 0)
    w2, x2, y2, z2 = np.moveaxis(np.asarray(b, float), -1, 0)
    return np.stack([
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2, w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2, w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2], -1)


def errors(estimate, reference, movement):
    """Root mean square of the total, heading and inclination error in deg (Laidig et al., Data 6(7), 2021)."""
    e = multiply(estimate, reference * [1, -1, -1, -1])
    e /= np.linalg.norm(e, axis=1)[:, None]
    total = 2 * np.arccos(np.clip(np.abs(e[:, 0]), 0, 1))
    heading = 2 * np.arctan(np.abs(e[:, 3] / e[:, 0]))
    inclination = 2 * np.arccos(np.clip(np.hypot(e[:, 0], e[:, 3]), 0, 1))
    return [np.rad2deg(np.sqrt(np.nanmean(x[movement] ** 2))) for x in (total, heading, inclination)]


def first(acc, mag, north_is_x):
    """The orientation of the first sample: z up, x or y to the north."""
    z = acc / np.linalg.norm(acc)
    north = mag - z * (mag @ z)
    north /= np.linalg.norm(north)
    rows = [north, np.cross(z, north), z] if north_is_x else [np.cross(north, z), north, z]
    return np.roll(scipy.spatial.transform.Rotation.from_matrix(np.array(rows)).as_quat(), 1)


def peers(gyr, acc, mag, reference, movement, rate):
    def better(runs):
        return min((errors(run(), reference, movement) for run in runs), key=lambda e: e[0])

    to_enu = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # from x north, y west
    nwu = dict(frequency=rate, q0=first(acc[0], mag[0], True))
    enu = dict(frequency=rate, q0=first(acc[0], mag[0], False))
    return {
        "VQF": errors(vqf.VQF(1 / rate).updateBatch(gyr, acc, mag)["quat9D"], reference, movement),
        "Madgwick": better([lambda: multiply(to_enu, Madgwick(gyr, acc, mag, **nwu).Q),
                            lambda: multiply(to_enu, Madgwick(gyr, acc, mag, gain=0.12, **nwu).Q)]),
        "Mahony": better([lambda: Mahony(gyr, acc, mag, **enu).Q,
                          lambda: Mahony(gyr, acc, mag, k_P=0.74, k_I=0.0012, **enu).Q]),
    }


def ours(program, design, path):
    def three(name, unit=""):
        return ",".join(f"imu_{name}_{axis}{unit}" for axis in "xyz")

    out = subprocess.run(
        [program, "replay", design, path, "--columns", three("gyr"), "--unit", "rad/s", "--json",
         "--aid", "accelerometer=" + three("acc", ":m/s^2"), "--aid", "magnetometer=" + three("mag"),
         "--reference", "opt_quat_w,opt_quat_x,opt_quat_y,opt_quat_z", "--movement", "movement"],
        capture_output=True, text=True)
    found = json.loads(out.stdout)["errors"]
    return [found[key + "_rmse_deg"] for key in ("total", "heading", "inclination")], found


def main():
    folder = pathlib.Path(sys.argv[1])
    program = sys.argv[2] if len(sys.argv) > 2 else "kfdesign"
    trials = sorted(p for p in folder.iterdir() if p.suffix in (".hdf5", ".mat"))
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        (scratch / "gyro.json").write_text(json.dumps(GYRO))
        (scratch / "force.json").write_text(json.dumps(FORCE))
        design = scratch / "att.json"
        subprocess.run(
            [program, "tune", scratch / "gyro.json", "--plant", "attitude", "--accelerometer", scratch / "force.json",
             "--aid", "magnetometer: 3 deg, 3 deg over 1 s", "-o", design], check=True, capture_output=True)
        print("| trial | kfdesign | VQF | Madgwick | Mahony | in claimed 3 sigma | NEES of 3 |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for path in trials:
            gyr, acc, mag, reference, movement, rate = load(path)
            mine, found = ours(program, design, path)
            rows = [mine, *peers(gyr, acc, mag, reference, movement, rate).values()]
            cells = [", ".join(f"{x:.2f}" for x in row) for row in rows]
            print(f"| {path.stem} | {' | '.join(cells)} | {100 * found['covered']:.1f} % | {found['nees']:.2f} |", flush=True)


if __name__ == "__main__":
    main()
