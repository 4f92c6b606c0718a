"""A generated high-speed recording of blinking eyes with exact truth; it shares no code with the tracker."""
