"""Block-compressed texels: BC6H by an encoder of ours, ASTC by Arm's, and what both lose."""
