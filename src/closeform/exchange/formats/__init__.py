"""Files that are not CCSDS messages: CSV, STK ephemerides, CZML and SPICE kernels."""
