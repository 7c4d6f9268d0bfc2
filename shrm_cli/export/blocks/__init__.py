"""Block-compressed texels: BC6H and UASTC HDR by encoders of ours, ASTC by Arm's."""
