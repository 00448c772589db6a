from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS
from texture_recordings.dataset import SlideDataset
from texture_recordings.tables import MAPPED, ImportReport, TableMapping, _types, import_tables, mapping_from

START_NS = 1_700_000_000 * NANOSECONDS
IMU_HZ, WRENCH_HZ, AUDIO_HZ = 100.0, 50.0, 4000.0
SECONDS = 4.0
TYPES = _types().types


def header(at_s: float) -> object:
    stamp_ns = START_NS + round(at_s * NANOSECONDS)
    stamp = TYPES['builtin_interfaces/msg/Time'](sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
    return TYPES['std_msgs/msg/Header'](stamp=stamp, frame_id='tool')


def vector(x: float, y: float = 0.0, z: float = 0.0) -> object:
    return TYPES['geometry_msgs/msg/Vector3'](x=x, y=y, z=z)


def imu(at_s: float) -> object:
    none = np.zeros(9)
    return TYPES['sensor_msgs/msg/Imu'](
        header=header(at_s), orientation=TYPES['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=none, angular_velocity=vector(0.0), angular_velocity_covariance=none,
        linear_acceleration=vector(np.sin(20 * at_s), 2.0, 3.0), linear_acceleration_covariance=none,
    )  # fmt: skip


def wrench(at_s: float) -> object:
    inner = TYPES['geometry_msgs/msg/Wrench'](force=vector(0.0, 0.0, 1.0 + at_s), torque=vector(0.0))
    return TYPES['geometry_msgs/msg/WrenchStamped'](header=header(at_s), wrench=inner)


def acceleration(at_s: float) -> object:
    inner = TYPES['geometry_msgs/msg/Accel'](linear=vector(np.sin(20 * at_s)), angular=vector(0.0))
    return TYPES['geometry_msgs/msg/AccelStamped'](header=header(at_s), accel=inner)


def array(at_s: float) -> object:
    """Two channels, of which ten samples come at once."""
    dimension = TYPES['std_msgs/msg/MultiArrayDimension']
    dims = [dimension(label='samples', size=10, stride=20), dimension(label='channels', size=2, stride=2)]
    times = at_s + np.arange(10) / (10 * WRENCH_HZ)
    data = np.stack([np.sin(20 * times), times], axis=1).astype(np.float32).ravel()
    layout = TYPES['std_msgs/msg/MultiArrayLayout'](dim=dims, data_offset=0)
    return TYPES['std_msgs/msg/Float32MultiArray'](layout=layout, data=data)


def joints(at_s: float) -> object:
    return TYPES['sensor_msgs/msg/JointState'](
        header=header(at_s), name=['finger', 'wrist'], position=np.array([np.sin(20 * at_s), 0.5]),
        velocity=np.array([0.04, 0.0]), effort=np.array([1.0, 2.0]),
    )  # fmt: skip


def audio(at_s: float) -> object:
    times = at_s + np.arange(int(AUDIO_HZ / WRENCH_HZ)) / AUDIO_HZ
    samples = np.round(16384 * np.sin(20 * times)).astype('<i2')
    return TYPES['audio_common_msgs/msg/AudioData'](data=samples.view(np.uint8))


def label(at_s: float) -> object:
    return TYPES['std_msgs/msg/String'](data='cork' if at_s < SECONDS / 2 else 'felt')


KINDS = {
    '/imu': (imu, 'sensor_msgs/msg/Imu', IMU_HZ),
    '/wrench': (wrench, 'geometry_msgs/msg/WrenchStamped', WRENCH_HZ),
    '/accel': (acceleration, 'geometry_msgs/msg/AccelStamped', IMU_HZ),
    '/array': (array, 'std_msgs/msg/Float32MultiArray', WRENCH_HZ),
    '/joints': (joints, 'sensor_msgs/msg/JointState', IMU_HZ),
    '/audio': (audio, 'audio_common_msgs/msg/AudioData', WRENCH_HZ),
    '/surface': (label, 'std_msgs/msg/String', IMU_HZ),
}


def write_bag(path: Path) -> Path:
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (make, msgtype, rate_hz) in KINDS.items():
            connection = writer.add_connection(topic, msgtype, typestore=_types())
            for at_s in np.arange(round(SECONDS * rate_hz)) / rate_hz:
                data = _types().serialize_cdr(make(at_s), msgtype)
                writer.write(connection, START_NS + round(at_s * NANOSECONDS), data)
    return path


def mapping(columns: list[str], **content: object) -> TableMapping:
    return mapping_from({
        'streams': {'signal': {'columns': columns}},
        'label': {'column': '/surface/data'},
        'slides': {'by': 'column', 'column': '/surface/data'},
        **content,
    })  # fmt: skip


def run(folder: Path, wanted: TableMapping) -> ImportReport:
    return import_tables(wanted, write_bag(folder / 'foreign'), folder / 'out', MAPPED['bag'])


@pytest.mark.parametrize(
    ('column', 'rate_hz'),
    [
        ('/imu/linear_acceleration.x', IMU_HZ),
        ('/accel/accel.linear.x', IMU_HZ),
        ('/array/data.0', 10 * WRENCH_HZ),
        ('/joints/position.finger', IMU_HZ),
        ('/audio/data', AUDIO_HZ),
    ],
)
def test_the_numbers_of_standard_messages_are_channels(tmp_path: Path, column: str, rate_hz: float) -> None:
    report = run(tmp_path, mapping([column]))
    assert report.slides == {'cork': 1, 'felt': 1}
    dataset = SlideDataset.from_bags(report.bags)
    [samples, _], _ = dataset.to_numpy()
    assert dataset[0].signals['signal'][0].sampling_rate_hz == pytest.approx(rate_hz, rel=0.002)
    assert len(samples) == pytest.approx(SECONDS / 2 * rate_hz, rel=0.01)
    times = np.arange(len(samples)) / rate_hz
    scale = 0.5 if column.startswith('/audio') else 1.0
    np.testing.assert_allclose(samples[:, 0], scale * np.sin(20 * times), atol=1e-3)


def test_streams_of_two_rates_and_a_force_along_the_slide_are_cut_at_the_same_times(tmp_path: Path) -> None:
    wanted = mapping_from({
        'streams': {
            'signal': {'columns': ['/imu/linear_acceleration.*']},
            'signal_static': {'columns': ['/wrench/wrench.force.z']},
        },
        'label': {'column': '/surface/data'},
        'slides': {'by': 'column', 'column': '/surface/data'},
        'conditions': {
            'force': {'column': '/wrench/wrench.force.z'},
            'speed': {'column': '/joints/velocity.finger'},
        },
    })  # fmt: skip
    report = run(tmp_path, wanted)
    dataset = SlideDataset.from_bags(report.bags)
    fast, _ = dataset.to_numpy('signal')
    slow, _ = dataset.to_numpy('signal_static')
    assert [len(samples) for samples in fast] == [200, 200]
    assert [len(samples) for samples in slow] == [100, 100]
    np.testing.assert_allclose(slow[1][:, 0], 1.0 + 2.0 + np.arange(100) / WRENCH_HZ, atol=1e-4)
    np.testing.assert_allclose([slide.force_n for slide in dataset], [2.0, 4.0], atol=0.02)
    np.testing.assert_allclose([slide.speed_m_s for slide in dataset], 0.04)
    assert len(dataset[0].sliding) == 20  # the force changes along the slide


def test_a_topic_that_is_not_there_is_refused_with_the_topics_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match=r"no column '/imu/linear_acceleration.w'; did you mean"):
        run(tmp_path, mapping(['/imu/linear_acceleration.w']))


def test_a_bag_without_any_of_the_topics_is_refused(tmp_path: Path) -> None:
    wanted = mapping_from({'streams': {'signal': {'columns': ['/nothing/x']}}, 'label': {'value': 'cork'}})
    with pytest.raises(InvalidData, match=r"'foreign' has no topic that the mapping names \(/nothing/x\)"):
        run(tmp_path, wanted)
