"""What drives a body: motors and their drive train, SMA springs, lags, and the number of drives with their names."""
