within WheelsetRig.Interfaces;
partial model PartialTwoFrames "Component between two frames"
  Frame frame_a annotation (Placement(transformation(extent={{-110,-10},{-90,10}})));
  Frame frame_b annotation (Placement(transformation(extent={{90,-10},{110,10}})));
  annotation (Icon(graphics={
    Rectangle(extent={{-90,40},{90,-40}}),
    Text(extent={{-90,30},{90,-30}}, textString="%name")}));
end PartialTwoFrames;
