"""Files of MATLAB, fuzzylite, IEEE 1855 and IEC 61131-7."""
