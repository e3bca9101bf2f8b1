"""What is done with whole maps: moving, merging, cropping, comparing."""
