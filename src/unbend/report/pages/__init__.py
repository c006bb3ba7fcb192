"""Interactive pages: one HTML file each, which opens in any browser without a network."""
