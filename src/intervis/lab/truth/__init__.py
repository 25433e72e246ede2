"""What is really visible: held-out returns and exact worlds, and the scores against them."""
