"""SynTouch BioTac fingertip: a fast pressure, and slow pressure, temperature and electrodes, over SPI."""
