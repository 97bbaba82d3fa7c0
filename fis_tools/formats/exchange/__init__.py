"""Files of MATLAB and fuzzylite."""
