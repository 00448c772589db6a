"""Quality of service of every topic of the suite, in one place."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# One second of 5 ms batches: a stalled subscriber loses samples, never holds the driver up.
SENSOR_QOS = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
# Few and small, none may be missing: the end of an exploration travels in them.
FEATURE_QOS = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)
# Who joins late gets the newest estimates, and so the verdict on the last exploration.
ESTIMATE_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# A node that starts late learns at once what is going on.
STATE_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
