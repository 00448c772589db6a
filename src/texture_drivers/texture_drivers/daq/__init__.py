"""Data acquisition finger of Jamali & Sammut 2010: 4 PVDF films and 4 strain gauges at 2.5 kHz."""
