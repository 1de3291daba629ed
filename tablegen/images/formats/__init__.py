"""What reads the images of one format each: bytes to channels, without trust in what the bytes say."""
