"""What a reviewer is told: audit, explanation, difference, simplification."""
