"""`texture lift`: lift a finger that an explorer left pressed."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['lift'].configure, SERVICE_COMMANDS['lift'].run
