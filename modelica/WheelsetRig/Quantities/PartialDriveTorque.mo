within WheelsetRig.Quantities;
partial model PartialDriveTorque "Slot: what changes the torque of the drive"
  extends PartialQuantity;
end PartialDriveTorque;
