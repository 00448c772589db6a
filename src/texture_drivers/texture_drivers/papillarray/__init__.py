"""Contactile PapillArray: nine pillars of silicone that measure force and displacement."""
