"""What a walk leaves behind: recordings, their figures and films."""
