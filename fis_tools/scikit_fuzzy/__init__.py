"""To and from scikit-fuzzy's control systems."""
