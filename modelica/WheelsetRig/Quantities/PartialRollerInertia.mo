within WheelsetRig.Quantities;
partial model PartialRollerInertia "Slot: what changes the inertia of the roller"
  extends PartialQuantity;
end PartialRollerInertia;
