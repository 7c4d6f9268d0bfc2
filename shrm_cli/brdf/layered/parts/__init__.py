"""What layers are made of: the base below them, borders of media, and light between both."""
