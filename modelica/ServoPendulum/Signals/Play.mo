within ServoPendulum.Signals;
model Play "Play between shaft and arm"
  extends Common.Signals.Backlash(play(unit="rad", max=0.1));
  annotation (
    __Workbench(effect(
      size="play", matters=2e-3, slots={"encoder"},
      separation="the arm moved by hand while the servo holds")),
    Documentation(info="<html>
<p>A horn on worn splines: the arm moves on by its inertia, and the shaft comes behind.</p>
</html>"));
end Play;
