"""Rules, amounts and findings in words."""
