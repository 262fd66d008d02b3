within WheelsetRig.Quantities;
partial model PartialWheelLoad "Slot: what changes the wheel load"
  extends PartialQuantity;
end PartialWheelLoad;
