within WheelsetRig.Quantities;
partial model PartialCreepStiffness "Slot: what changes the stiffness of the contact"
  extends PartialQuantity;
end PartialCreepStiffness;
