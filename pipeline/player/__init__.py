"""The player of a page: every case of a run is flown in the browser by the product's own compiled code."""
