within WheelsetRig.Quantities;
partial model PartialRollerRadius "Slot: what changes the roller radius"
  extends PartialQuantity;
end PartialRollerRadius;
