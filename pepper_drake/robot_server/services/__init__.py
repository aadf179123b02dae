"""NAOqi's modules, one file for each or for a few alike."""
