"""`texture reboot`: reboot the motors of a hand."""

from texture_bringup.service_command import SERVICE_COMMANDS

configure, run = SERVICE_COMMANDS['reboot'].configure, SERVICE_COMMANDS['reboot'].run
