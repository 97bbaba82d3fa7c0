"""Files of MATLAB, fuzzylite and IEC 61131-7."""
