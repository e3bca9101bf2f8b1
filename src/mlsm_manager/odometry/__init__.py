"""What a reported path says of itself: steps that no vehicle makes, and poses that stand still."""
