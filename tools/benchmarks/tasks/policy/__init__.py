"""Policies trained on twins and tried on the bench robot, which shares no physics with them."""
