"""The review page: one HTML file of one controller and its flights, for the person who signs it off."""
