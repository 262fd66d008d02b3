within TrainRig.Slots;
model UnchangedAxles "Null version: nothing changes"
  extends PartialAxles;
equation
  y = u;
end UnchangedAxles;
