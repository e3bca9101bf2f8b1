"""What a recording holds and lacks, before anything is made of it."""
