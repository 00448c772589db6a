"""`texture stop`: end the exploration and lift the finger, from any phase."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['stop'].configure, SERVICE_COMMANDS['stop'].run
