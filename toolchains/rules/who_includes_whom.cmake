message(STATUS "skeleton")
