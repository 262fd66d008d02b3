within WheelsetRig.Brakes;
model DirectCylinder "Null version: the measured pressure presses the pads"
  extends PartialCylinder;
equation
  p = pB;
  rest = restBefore;
end DirectCylinder;
