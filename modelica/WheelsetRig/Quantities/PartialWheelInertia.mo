within WheelsetRig.Quantities;
partial model PartialWheelInertia "Slot: what changes the inertia of the wheelset"
  extends PartialQuantity;
end PartialWheelInertia;
