within WheelsetRig.Quantities;
partial model PartialWheelRadius "Slot: what changes the wheel radius"
  extends PartialQuantity;
end PartialWheelRadius;
