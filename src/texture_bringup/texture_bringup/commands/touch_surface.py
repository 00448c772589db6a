"""`texture touch-surface`: take one of the three touches that find the surface."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['touch-surface'].configure, SERVICE_COMMANDS['touch-surface'].run
