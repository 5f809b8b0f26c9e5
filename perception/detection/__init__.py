"""Vehicle detection: networks on image and maps, and location of vehicles in the scan (thesis chapter 6)."""
