"""`texture recover`: free the arm from a fault."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['recover'].configure, SERVICE_COMMANDS['recover'].run
