"""The files of `kfdesign export`, each loaded by the package that reads it, number by number against the parameters.

    python benches/consumers.py [--folder target/consumers] [--kfdesign target/release/kfdesign]

Makes a virtual environment in the folder (needs the network once), exports a gyro and an accelerometer for every consumer, loads each file with
the consumer's own package, or with the library that the consumer reads it with, and prints a table. What has no package is named.
Exit status 1 if a number differs by more than the nine digits that are written.
"""
import argparse, contextlib, io, json, math, subprocess, sys
from pathlib import Path

PACKAGES = ["gtsam==4.3.0", "numpy==2.4.6", "opencv-python-headless==5.0.0.93", "pymavlink==2.4.50", "PyYAML==6.0.3"]
# rad/s/sqrt(Hz), rad/s, s; m/s^2/sqrt(Hz), m/s^3/sqrt(Hz); Hz
N, SIGMA, TC = math.radians(0.0562), math.radians(0.0280596), 193.9312
K = SIGMA * math.sqrt(2 / TC)
NA, KA = 0.002, 3e-4
RATE = 200.0
TURN_ON = math.radians(0.6)
GYRO = {"format": "kfdesign-params/1", "quantity": "angular-rate", "sample_rate": "200 Hz", "axes": [
    {"name": axis, "turn_on_bias": {"std_dev": "0.6 deg/s"}, "white": {"density": "0.0562 deg/s/sqrt(Hz)"},
     "gauss_markov": {"std_dev": "0.0280596 deg/s", "correlation_time": "193.9312 s"}} for axis in "xyz"]}
ACCELEROMETER = {"format": "kfdesign-params/1", "quantity": "specific-force", "sample_rate": "200 Hz", "axes": [
    {"name": axis, "white": {"density": "0.002 m/s^2/sqrt(Hz)"}, "rate_random_walk": {"density": "0.0003 m/s^2/sqrt(s)"}} for axis in "xyz"]}
NO_PACKAGE = {"gnss-ins-sim": "not on PyPI", "navego": "MATLAB", "matlab": "MATLAB", "gazebo": "C++ alone"}


def opencv(path):
    """The real numbers of a file that the consumer opens with cv::FileStorage; of OpenVINS those in `imu0`."""
    import cv2
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), f"{path} is not opened"
    root = storage.root() if storage.getNode("imu0").empty() else storage.getNode("imu0")
    return {key: root.getNode(key).real() for key in root.keys() if root.getNode(key).isReal()}


def kalibr(path):
    """ImuParameters of Kalibr: all four densities and the rate above zero; the white ones times sqrt(rate), the walks as they are."""
    import yaml
    data = yaml.safe_load(path.read_text())
    assert isinstance(data["rostopic"], str) and data["update_rate"] > 0
    step = math.sqrt(1 / data["update_rate"])
    out = {}
    for sensor in ["accelerometer", "gyroscope"]:
        density, walk = data[f"{sensor}_noise_density"], data[f"{sensor}_random_walk"]
        assert density > 0 and walk > 0
        out |= {f"{sensor} per sample": density / step, f"{sensor} walk": walk}
    return out


def gtsam(path):
    """The script as it is; then one second of preintegration: the variance of rotation and of the biases that it gives."""
    import gtsam, numpy as np
    scope = {}
    exec(compile(path.read_text(), str(path), "exec"), scope)
    params = scope["params"]
    sums = gtsam.PreintegratedCombinedMeasurements(params, gtsam.imuBias.ConstantBias())
    for _ in range(int(RATE)):
        sums.integrateMeasurement(np.array([0, 0, 9.80665]), np.zeros(3), 1 / RATE)
    covariance = sums.preintMeasCov()
    # rotation, position, velocity, bias of the accelerometer, of the gyro; the bias's own walk adds K^2/3 to the rotation
    rotation = covariance[0, 0]
    return {"gyro covariance": params.getGyroscopeCovariance()[0, 0], "accelerometer covariance": params.getAccelerometerCovariance()[2, 2],
            "rotation after 1 s": rotation, "accelerometer bias after 1 s": covariance[9, 9], "gyro bias after 1 s": covariance[12, 12]}


def px4(path):
    """Lines of QGroundControl: vehicle, component, name, value, MAVLink type; each as the PARAM_SET message that the vehicle gets."""
    from pymavlink.dialects.v20 import common as mavlink
    link, out = mavlink.MAVLink(None), {}
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            vehicle, component, name, value, kind = line.split("\t")
            assert int(kind) == mavlink.MAV_PARAM_TYPE_REAL32
            sent = mavlink.MAVLink_param_set_message(int(vehicle), int(component), name.encode(), float(value), int(kind)).pack(link)
            got = mavlink.MAVLink(None).parse_char(sent)
            out[got.param_id] = got.param_value
    return out


def ardupilot(path):
    from pymavlink.mavparm import MAVParmDict
    params, said = MAVParmDict(), io.StringIO()
    with contextlib.redirect_stdout(said):
        params.load(str(path))
    assert "Invalid" not in said.getvalue(), said.getvalue()
    return dict(params)


# consumer: package, reader, flags, file, what the numbers must be
def consumers():
    r, ekf2, ekf3 = math.sqrt, math.sqrt(0.01), math.sqrt(0.012)
    # the walk of the gyro's bias is in the rotation, as GTSAM adds it up: sums of k^2 over the samples before
    n = int(RATE)
    rotation = N * N + K * K / RATE**3 * sum(k * k for k in range(n))
    return {
        "kalibr": ("PyYAML", kalibr, "imu.yaml", {"accelerometer per sample": NA * r(RATE), "accelerometer walk": KA, "gyroscope per sample": N * r(RATE), "gyroscope walk": K}),
        "openvins": ("opencv-python-headless", opencv, "openvins.yaml", {"gyroscope_noise_density": N, "gyroscope_random_walk": K, "accelerometer_noise_density": NA, "accelerometer_random_walk": KA, "update_rate": RATE}),
        "orbslam3": ("opencv-python-headless", opencv, "orbslam3.yaml", {"IMU.NoiseGyro": N, "IMU.GyroWalk": K, "IMU.NoiseAcc": NA, "IMU.AccWalk": KA, "IMU.Frequency": RATE}),
        "vins": ("opencv-python-headless", opencv, "vins.yaml", {"gyr_n": N * r(2 * RATE), "gyr_w": K * r(RATE), "acc_n": NA * r(2 * RATE), "acc_w": KA * r(RATE)}),
        "gtsam": ("gtsam", gtsam, "imu.py", {"gyro covariance": N * N, "accelerometer covariance": NA * NA, "rotation after 1 s": rotation, "accelerometer bias after 1 s": KA * KA, "gyro bias after 1 s": K * K}),
        "px4": ("pymavlink", px4, "ekf2.params", {"EKF2_GYR_NOISE": N / ekf2, "EKF2_GYR_B_NOISE": K / ekf2, "EKF2_ACC_NOISE": NA / ekf2, "EKF2_ACC_B_NOISE": KA / ekf2, "EKF2_GBIAS_INIT": TURN_ON}),
        "ardupilot": ("pymavlink", ardupilot, "ekf3.parm", {"EK3_GYRO_P_NSE": N / ekf3, "EK3_GBIAS_P_NSE": K / ekf3, "EK3_ACC_P_NSE": NA / ekf3, "EK3_ABIAS_P_NSE": KA / ekf3}),
    }


def inside(folder, kfdesign):
    """In the environment: exports, loads, compares."""
    from importlib.metadata import version
    (folder / "gyro.json").write_text(json.dumps(GYRO))
    (folder / "accelerometer.json").write_text(json.dumps(ACCELEROMETER))
    print("| consumer | read with | numbers | largest difference |\n| --- | --- | --- | --- |")
    bad = False
    for consumer, (package, read, name, expected) in consumers().items():
        flags = ["--accelerometer", "accelerometer.json", "-o", name]
        subprocess.run([kfdesign, "export", "gyro.json", "--to", consumer, *flags], cwd=folder, check=True, capture_output=True)
        found = read(folder / name)
        # what goes over MAVLink is in single precision
        allowed = 6e-8 if consumer == "px4" else 1e-8
        worst = max(abs(found[key] / value - 1) for key, value in expected.items())
        bad |= worst > allowed
        print(f"| {consumer} | {package} {version(package)} | {len(expected)} | {worst:.1e}{' TOO LARGE' if worst > allowed else ''} |")
        if worst > allowed:
            print({key: (found[key], value) for key, value in expected.items()})
    for consumer, why in NO_PACKAGE.items():
        print(f"| {consumer} | no package: {why} | | |")
    return bad


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("target/consumers"))
    parser.add_argument("--kfdesign", type=Path, default=Path("target/release/kfdesign"))
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    folder, kfdesign = args.folder.resolve(), args.kfdesign.resolve()
    if args.inside:
        sys.exit(int(inside(folder, str(kfdesign))))
    folder.mkdir(parents=True, exist_ok=True)
    python = folder / "env/bin/python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "env"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *PACKAGES], check=True)
    sys.exit(subprocess.run([python, __file__, "--inside", "--folder", folder, "--kfdesign", kfdesign]).returncode)


main()
