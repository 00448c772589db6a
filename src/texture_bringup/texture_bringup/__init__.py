"""Launch files, configuration, the stand-alone launcher and the texture command."""
