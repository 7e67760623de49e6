"""What binding changes in the .blend, and how it goes back."""
