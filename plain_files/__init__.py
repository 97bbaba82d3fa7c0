"""Files and output as plain data: what is read, what is printed, and the documents that results become.

It knows no fuzzy systems, recordings or flights; the other packages stand on it, and it on none of them.
"""
