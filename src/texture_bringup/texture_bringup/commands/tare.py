"""`texture tare`: tare a sensor that nothing touches."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['tare'].configure, SERVICE_COMMANDS['tare'].run
