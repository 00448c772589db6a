"""`texture forget-touches`: begin the touches that find the surface again."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['forget-touches'].configure, SERVICE_COMMANDS['forget-touches'].run
