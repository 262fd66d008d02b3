within SealFriction.Interfaces;
model NoSpring "Null version: no spring"
  extends PartialSpring;
equation
  f = 0.0;
end NoSpring;
